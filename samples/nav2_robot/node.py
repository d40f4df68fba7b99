"""The robot as a ROS 2 node: the only module that talks to Nav2.

It owns the clock: /clock and /tf every step, /odom, /scan, /battery_state and /map as the robot has them. It obeys
/cmd_vel, sends the goals one after the other, and records what operators record.
"""

from __future__ import annotations

import array
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from importlib import import_module
from typing import Any

from nav2_robot import laser
from nav2_robot.clock import Answers
from nav2_robot.messages import BATTERY_STEPS, ODOMETRY_STEPS, SCAN_STEPS
from nav2_robot.recorder import TOPICS, Recorder
from nav2_robot.robot import STEP_S, Robot
from nav2_robot.servers import SERVERS, Servers
from nav2_robot.world import CELL_M, Pose

GOAL_LIMIT_S = 60.0
"""Whoever waits for a goal gives it up then, and the mission with it."""

_CLOCK_BEGINS_S = 10.0
_START_LIMIT_S, _CALL_LIMIT_S = 90.0, 10.0
"""Of real time."""
_START_SPEEDUP = 3.0
_SETTLE_S = 2.0
_OWED = 3
"""Subscriptions that tell of it: the controller's command, its state and the planner's."""
_ASK_STEPS = 4
"""So often the answers to goals are looked for."""

_SUCCEEDED, _ABORTED = 4, 6
_ACTIVE = (1, 2, 3)


class NavigationError(Exception):
    """Nav2 did not start, or ended in the middle."""


@dataclass
class Told:
    """How a mission went."""

    results: list[int] = field(default_factory=list)
    """Code of each goal, as action_msgs/GoalStatus has it."""
    mission_s: float = 0.0
    wall_s: float = 0.0
    late: int = 0
    waited_s: float = 0.0

    @property
    def reached(self) -> int:
        return self.results.count(_SUCCEEDED)


class Drive:
    """One mission with Nav2; until Nav2 is ready a robot that does not move stands in for it."""

    def __init__(self, make: Callable[[], Robot], recorder: Recorder, controller_hz: float, speedup: float) -> None:
        import rclpy
        from nav2_msgs.action import NavigateToPose
        from rclpy.action import ActionClient
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.node import Node
        from rclpy.signals import SignalHandlerOptions

        self.make, self.recorder, self.speedup = make, recorder, speedup
        self.robot = make()
        self.answers = Answers(1.0 / controller_hz)
        self.steps = 0
        self._next_wall = time.monotonic()
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
        # What is published and recorded is most of the work: taken by hand, as an executor needs several times as long.
        self.node = Node("robot", start_parameter_services=False)
        self._publishers = self._published()
        self._subscriptions = self._subscribed()
        self._client = Node("robot_client", start_parameter_services=False)
        self._goals = ActionClient(self._client, NavigateToPose, "/navigate_to_pose")
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._client)

    def close(self) -> None:
        import rclpy

        self._executor.shutdown()
        self._goals.destroy()
        self._client.destroy_node()
        self.node.destroy_node()
        rclpy.try_shutdown()

    def run(self, servers: Servers) -> Told:
        """The whole mission.

        Raises:
            NavigationError: Nav2 did not start or is gone.
        """
        self._publish_fixed()
        self._start(servers)
        self._record_parameters()
        parked, self.robot = self.robot, self.make()
        self.robot.now_s = parked.now_s
        self._advance(servers, _SETTLE_S)
        told, begun_s, begun_wall = Told(), self.robot.now_s, time.monotonic()
        for goal in self.robot.conditions.world.goals:
            told.results.append(self._go(servers, goal))
            if told.results[-1] != _SUCCEEDED:
                break
            self._advance(servers, 0.5)
        told.mission_s, told.wall_s = self.robot.now_s - begun_s, time.monotonic() - begun_wall
        told.late, told.waited_s = self.answers.late, self.answers.waited_s
        self._advance(servers, _SETTLE_S)
        return told

    def _published(self) -> Mapping[str, Any]:
        from nav_msgs.msg import OccupancyGrid, Odometry
        from rclpy.qos import DurabilityPolicy, QoSProfile
        from rosgraph_msgs.msg import Clock
        from sensor_msgs.msg import BatteryState, LaserScan
        from tf2_msgs.msg import TFMessage

        kept = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        wanted = {"/clock": (Clock, 10), "/tf": (TFMessage, 100), "/tf_static": (TFMessage, kept),
                  "/map": (OccupancyGrid, kept), "/odom": (Odometry, 20), "/scan": (LaserScan, 5),
                  "/battery_state": (BatteryState, 5)}  # fmt: skip
        return {topic: self.node.create_publisher(kind, topic, quality) for topic, (kind, quality) in wanted.items()}

    def _subscribed(self) -> list[tuple[Any, Callable[[Any], None]]]:
        """What is listened to, and what is done with a message of it: serialized for the recording."""
        from action_msgs.msg import GoalStatusArray
        from geometry_msgs.msg import Twist
        from rclpy.qos import DurabilityPolicy, QoSProfile

        many = QoSProfile(depth=1000)
        kept = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        latest = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        found: list[tuple[Any, Callable[[Any], None]]] = []

        def listen(kind: Any, topic: str, quality: Any, heard: Callable[[Any], None], raw: bool = False) -> None:
            found.append((self.node.create_subscription(kind, topic, heard, quality, raw=raw), heard))

        for topic, kind in TOPICS.items():
            quality = kept if topic == "/rosout" or topic.endswith("/status") else many
            listen(_type(kind), topic, quality, partial(self._record, topic), raw=True)
        listen(Twist, "/cmd_vel", 1, self._obey)
        listen(Twist, "/cmd_vel_nav", many, lambda _: self.answers.commanded(self.robot.now_s))
        for action, tell in (("follow_path", self.answers.driving), ("compute_path_to_pose", self.answers.planning)):
            listen(GoalStatusArray, f"/{action}/_action/status", latest, partial(_tell, tell))
        return found

    def _listen(self, last: int = 0) -> None:
        """Take what came, of all that is listened to or of the last few: those that tell what Nav2 owes."""
        for subscription, heard in self._subscriptions[-last:]:
            with subscription.handle:
                while (taken := subscription.handle.take_message(subscription.msg_type, subscription.raw)) is not None:
                    heard(taken[0])

    def _record(self, topic: str, data: bytes) -> None:
        self.recorder.write(topic, self.robot.now_s, data)

    def _obey(self, command: Any) -> None:
        self.robot.command(command.linear.x, command.angular.z)

    def _start(self, servers: Servers) -> None:
        """Configure and activate every server in Nav2's order, while the clock runs: they wait for transforms."""
        from lifecycle_msgs.msg import Transition
        from lifecycle_msgs.srv import ChangeState

        for number in (Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE):
            for name in SERVERS:
                asking = self._client.create_client(ChangeState, f"/{name}/change_state")
                self._tick_until(servers, asking.service_is_ready, f"{name} did not start")
                request = ChangeState.Request(transition=Transition(id=number))
                answer = asking.call_async(request)
                self._tick_until(servers, answer.done, f"{name} did not answer")
                if not answer.result().success:
                    raise NavigationError(f"{name} could not be {'configured' if number == 1 else 'activated'}")
                self._client.destroy_client(asking)

    def _tick_until(self, servers: Servers, is_so: Callable[[], bool], otherwise: str) -> None:
        until = time.monotonic() + _START_LIMIT_S
        while not is_so():
            if time.monotonic() > until:
                raise NavigationError(otherwise)
            self._tick(servers, moves=False)
            self._executor.spin_once(timeout_sec=0.0)

    def _record_parameters(self) -> None:
        """Each server's parameters as the event that it sent when it declared them, before anybody listened."""
        from rcl_interfaces.msg import Parameter, ParameterEvent
        from rcl_interfaces.srv import GetParameters, ListParameters
        from rclpy.serialization import serialize_message

        for node in (
            *(f"/{name}" for name in SERVERS),
            "/local_costmap/local_costmap",
            "/global_costmap/global_costmap",
        ):
            names = self._called(ListParameters, f"{node}/list_parameters", ListParameters.Request()).result.names
            values = self._called(GetParameters, f"{node}/get_parameters", GetParameters.Request(names=names)).values
            made = [Parameter(name=name, value=value) for name, value in zip(names, values, strict=True)]
            event = ParameterEvent(stamp=self._stamp(), node=node, new_parameters=made)
            self._record("/parameter_events", serialize_message(event))

    def _called(self, kind: Any, name: str, request: Any) -> Any:
        asking = self._client.create_client(kind, name)
        try:
            until = time.monotonic() + _CALL_LIMIT_S
            answer = asking.call_async(request) if asking.wait_for_service(_CALL_LIMIT_S) else None
            while answer is not None and time.monotonic() < until:
                if answer.done():
                    return answer.result()
                self._executor.spin_once(timeout_sec=0.005)
        finally:
            self._client.destroy_client(asking)
        raise NavigationError(f"no answer from {name}")

    def _go(self, servers: Servers, goal: Pose) -> int:
        """Send a goal and wait for its end; the code of its state."""
        from nav2_msgs.action import NavigateToPose

        if not self._goals.wait_for_server(_CALL_LIMIT_S):
            raise NavigationError("there is no /navigate_to_pose")
        wanted = NavigateToPose.Goal()
        wanted.pose.header.frame_id, wanted.pose.header.stamp = "map", self._stamp()
        wanted.pose.pose.position.x, wanted.pose.pose.position.y = goal[:2]
        wanted.pose.pose.orientation.z, wanted.pose.pose.orientation.w = _half(goal[2])
        accepted = self._goals.send_goal_async(wanted)
        self._advance(servers, GOAL_LIMIT_S, accepted.done)
        handle = accepted.result() if accepted.done() else None
        if handle is None or not handle.accepted:
            return _ABORTED
        result = handle.get_result_async()
        self._advance(servers, GOAL_LIMIT_S, result.done)
        if not result.done():
            handle.cancel_goal_async()
            self._advance(servers, 5.0, result.done)
        return int(result.result().status) if result.done() else _ABORTED

    def _advance(self, servers: Servers, time_s: float, is_over: Callable[[], bool] = lambda: False) -> None:
        """Simulated time goes on for so long, or until something is over."""
        until = self.robot.now_s + time_s - STEP_S / 2
        while self.robot.now_s < until and not is_over():
            self._tick(servers)
            if self.steps % _ASK_STEPS == 0:
                self._executor.spin_once(timeout_sec=0.0)

    def _tick(self, servers: Servers, moves: bool = True) -> None:
        if moves:
            self.robot.step()
        else:
            self.robot.now_s += STEP_S
        self.steps += 1
        self._publish()
        self._listen()
        self.answers.wait(self.robot.now_s, lambda: self._listen(_OWED), self._publish_clock)
        if self.steps % 40 == 0 and servers.ended():
            raise NavigationError(f"{servers.ended()} ended")
        # While Nav2 starts it needs time of the machine, not of the mission.
        pace = self.speedup if moves else min(self.speedup, _START_SPEEDUP)
        self._next_wall = max(self._next_wall + STEP_S / pace, time.monotonic() - 0.1)
        time.sleep(max(0.0, self._next_wall - time.monotonic()))

    def _publish(self) -> None:
        from sensor_msgs.msg import BatteryState

        self._publish_transform()
        if self.steps % ODOMETRY_STEPS == 0:
            self._publish_odometry()
        if self.steps % SCAN_STEPS == 0:
            self._publish_scan()
        if self.steps % BATTERY_STEPS == 0:
            state = BatteryState(voltage=self.robot.battery.volts, current=-self.robot.battery.amps, present=True)
            state.header.stamp, state.header.frame_id = self._stamp(), "base_link"
            state.percentage, state.power_supply_status = math.nan, BatteryState.POWER_SUPPLY_STATUS_DISCHARGING
            self._publishers["/battery_state"].publish(state)
        self._publish_clock()

    def _publish_clock(self) -> None:
        from rosgraph_msgs.msg import Clock

        self._publishers["/clock"].publish(Clock(clock=self._stamp()))

    def _publish_transform(self) -> None:
        from tf2_msgs.msg import TFMessage

        x, y, yaw = self.robot.odometry
        self._publishers["/tf"].publish(TFMessage(transforms=[self._transform("odom", "base_link", x, y, yaw)]))

    def _publish_odometry(self) -> None:
        from nav_msgs.msg import Odometry

        told = Odometry(child_frame_id="base_link")
        told.header.stamp, told.header.frame_id = self._stamp(), "odom"
        x, y, yaw = self.robot.odometry
        told.pose.pose.position.x, told.pose.pose.position.y = x, y
        told.pose.pose.orientation.z, told.pose.pose.orientation.w = _half(yaw)
        told.twist.twist.linear.x, told.twist.twist.angular.z = self.robot.measured
        self._publishers["/odom"].publish(told)

    def _publish_scan(self) -> None:
        from sensor_msgs.msg import LaserScan

        ranges = self.robot.scan()
        if ranges is None:
            return
        scan = LaserScan(
            angle_min=laser.ANGLE_MIN, angle_max=laser.ANGLE_MAX, scan_time=laser.PERIOD_S,
            angle_increment=(laser.ANGLE_MAX - laser.ANGLE_MIN) / (laser.RAYS - 1),
            range_min=laser.RANGE_MIN, range_max=laser.RANGE_MAX, ranges=array.array("f", ranges.tolist()),
        )  # fmt: skip
        scan.header.stamp, scan.header.frame_id = self._stamp(), "laser"
        self._publishers["/scan"].publish(scan)

    def _publish_fixed(self) -> None:
        """The map, and what never moves: the laser on the body, the odometry's frame in the map."""
        from nav_msgs.msg import OccupancyGrid
        from tf2_msgs.msg import TFMessage

        fixed = [self._transform("map", "odom", 0.0, 0.0, 0.0),
                 self._transform("base_link", "laser", laser.AHEAD_M, 0.0, 0.0)]  # fmt: skip
        self._publishers["/tf_static"].publish(TFMessage(transforms=fixed))
        cells, (x, y) = self.robot.world.map()
        grid = OccupancyGrid(data=array.array("b", cells.tobytes()))
        grid.header.stamp, grid.header.frame_id = self._stamp(), "map"
        grid.info.resolution, grid.info.height, grid.info.width = CELL_M, *cells.shape
        grid.info.origin.position.x, grid.info.origin.position.y = x, y
        self._publishers["/map"].publish(grid)

    def _transform(self, parent: str, child: str, x: float, y: float, yaw: float) -> Any:
        from geometry_msgs.msg import TransformStamped

        made = TransformStamped(child_frame_id=child)
        made.header.stamp, made.header.frame_id = self._stamp(), parent
        made.transform.translation.x, made.transform.translation.y = x, y
        made.transform.rotation.z, made.transform.rotation.w = _half(yaw)
        return made

    def _stamp(self) -> Any:
        from builtin_interfaces.msg import Time

        seconds, nanoseconds = divmod(round((_CLOCK_BEGINS_S + self.robot.now_s) * 1e9), 1_000_000_000)
        return Time(sec=seconds, nanosec=nanoseconds)


def _tell(tell: Callable[[bool], None], told: Any) -> None:
    """Pass on whether any goal of an action is under way."""
    tell(any(one.status in _ACTIVE for one in told.status_list))


def _type(kind: str) -> Any:
    """The class of a type such as `nav_msgs/msg/Path`; a part of an action is found in the action."""
    package, where, name = kind.split("/")
    action, _, part = name.partition("_")
    found = getattr(import_module(f"{package}.{where}"), action)
    return getattr(found.Impl, part) if part else found


def _half(yaw: float) -> tuple[float, float]:
    """z and w of a turn about the vertical."""
    return math.sin(yaw / 2), math.cos(yaw / 2)

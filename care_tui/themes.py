"""The app's own theme, beside those of Textual."""

from __future__ import annotations

from textual.theme import Theme

DEFAULT = "ansi-dark"
"""The terminal's own colours: right on any background, with 16 colours, and half the bytes on a slow link."""

OWN_COLOURS = {
    "accent": "ansi_cyan",
    "text-accent": "ansi_cyan",
    "border": "ansi_cyan",
    "footer-key-foreground": "ansi_cyan",
    "text-primary": "ansi_magenta",
}
"""One accent, which is no colour of a verdict."""

HIGH_CONTRAST = Theme(
    name="high-contrast",
    primary="#ffff00",
    secondary="#00ffff",
    accent="#00ffff",
    warning="#ffd700",
    error="#ff8080",
    success="#80ff80",
    foreground="#ffffff",
    background="#000000",
    surface="#000000",
    panel="#202020",
    boost="#000000",
    dark=True,
    variables={
        "text-muted": "#ffffff",
        "text-error": "#ff9a9a",
        "text-success": "#8dff8d",
        "text-warning": "#ffe14d",
        "text-accent": "#66ffff",
    },
)

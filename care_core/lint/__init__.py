"""What is wrong with configuration files, without any log: a module a family of rules, the rules themselves as data."""

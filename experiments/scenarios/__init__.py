"""The scenarios that come with truetip, and what can stand in one."""

"""Flight logs that are no MCAP; `any_log` picks the module."""

"""The user's own simulators: functions and commands, and the keeper of processes."""

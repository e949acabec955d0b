"""Effects of grains and rig that a simulation can switch on."""

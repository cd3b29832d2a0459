"""What a simulated run does: its configuration, its plan, its episodes and the frames that are recorded."""

"""What a run leaves behind: frames, impacts, removals, checkpoints, last states, and their files."""

"""What a run leaves behind: frames, events, last states, and their files."""

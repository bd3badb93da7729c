"""Following one object from frame to frame."""

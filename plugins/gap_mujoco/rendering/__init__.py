"""Software rendering: cameras, labels, sensor noise and video."""

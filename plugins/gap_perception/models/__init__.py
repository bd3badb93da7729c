"""Object models and meshes: learned views, visual hulls, files."""

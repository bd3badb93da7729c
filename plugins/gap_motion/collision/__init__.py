"""Robot spheres against a world of boxes, cylinders, meshes and clouds."""

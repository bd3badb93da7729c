"""`gap bench grasps`: sampled grasps executed in physics."""

"""Collision-free motions to poses, grasps and along lines."""

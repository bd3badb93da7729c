"""The MuJoCo model of a task: robots, objects, supports and cameras composed into one scene."""

"""Forward kinematics, inverse kinematics and dynamics of a robot's model."""

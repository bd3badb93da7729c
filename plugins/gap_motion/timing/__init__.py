"""Time-parameterisation inside velocity, acceleration, jerk and torque limits."""

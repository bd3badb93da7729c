"""Joint controllers, trajectory following, stopping, contact reaction and the parallel gripper."""

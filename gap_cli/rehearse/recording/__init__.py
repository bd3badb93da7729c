"""What an episode leaves to look at: MCAP logs, video and still frames."""

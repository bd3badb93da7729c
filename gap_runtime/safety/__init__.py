"""What stops the arms when the interpreter fails: protective stop and watchdog."""

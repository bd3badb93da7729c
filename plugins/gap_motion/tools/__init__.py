"""The motion tools by catalogue name."""

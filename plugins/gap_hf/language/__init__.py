"""Vision-language models that answer and point."""

"""The graph language as people and programs write it: builder calls, what they record, and its source form."""

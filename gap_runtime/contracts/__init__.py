"""What everyone agrees on: types, tools, skills, tasks, worlds, robots. Imports nothing else of the engine."""

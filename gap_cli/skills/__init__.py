"""SKILL.md + contract.yaml -> SkillBundle: the skill library as agents, validator and author read it."""

from gap_cli.skills.bundle import SkillBundle, load_bundle
from gap_cli.skills.frontmatter import Frontmatter, parse_skill_md
from gap_cli.skills.library import SkillLibrary, load_library

__all__ = ["Frontmatter", "SkillBundle", "SkillLibrary", "load_bundle", "load_library", "parse_skill_md"]

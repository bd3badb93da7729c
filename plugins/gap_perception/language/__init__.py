"""Phrases, questions and relations over what is seen."""

"""Scenes to judge: suites, random linkages, hard families."""

"""Presentation of a scene and its solution: tables, words, drawings, pages."""

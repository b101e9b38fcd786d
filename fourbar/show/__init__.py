"""What is shown of a scene and its solution: tables, words, drawings, pages."""

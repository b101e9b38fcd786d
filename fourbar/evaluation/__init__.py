"""The evaluation of what a scene asks for: stage by stage, block by block, with error bars."""

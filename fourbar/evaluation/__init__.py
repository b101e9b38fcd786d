"""The evaluation of a scene: stage by stage, block by block, with error bars."""

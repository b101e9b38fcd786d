"""The report: the verdict first, then what was compared.

How independent it was, and what it cost, follow.
"""

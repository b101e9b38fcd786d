"""The report: verdict first, then what was compared, how independent it was, what it cost."""

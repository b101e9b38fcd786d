"""Largest error, failing rows and time of every engine on every model, over commits."""

import math

import fourbar
from fourbar.scene import command, with_signs
from fourbar_validation.engines.registry import ENGINES
from fourbar_validation.places import MODELS
from fourbar_validation.run.judge import judge

BY_NAME = {engine.name: engine for engine in ENGINES}
SCENES = {path.stem: path for path in sorted(MODELS.glob("*.toml"))}


class Verdict:
    """What `run` says of one engine on one model."""

    params = (list(BY_NAME), list(SCENES))
    param_names = ("engine", "model")
    timeout = 600

    def setup_cache(self):
        """Judge each model once, by every engine that is installed."""
        here = [engine for engine in ENGINES if not engine.missing()]
        verdicts = {}
        for model, path in SCENES.items():
            rows = judge(model, fourbar.load(path), here).rows
            for name in BY_NAME:
                judged = [
                    row
                    for row in rows
                    if row.engine == name and (row.compared or row.failed)
                ]
                used = [
                    math.inf if math.isnan(row.error) else row.error / row.allowed
                    for row in judged
                    if row.error
                ]
                failing = sum(row.failed for row in judged) if judged else math.nan
                verdicts[name, model] = max(used, default=math.nan), failing
        return verdicts

    def track_worst_error(self, verdicts, engine, model):
        """Return the largest error over the allowed one.

        NaN if the engine gave no answer to compare.
        """
        return verdicts[engine, model][0]

    def track_failing_rows(self, verdicts, engine, model):
        """Return the number of rows that fail; NaN if nothing was compared."""
        return verdicts[engine, model][1]

    track_worst_error.unit, track_failing_rows.unit = "of the allowed error", "rows"


class Answer:
    """Time of one engine for all positions of one model."""

    params, param_names = Verdict.params, Verdict.param_names

    def setup(self, engine, model):
        """Start the engine and load the model, outside the clock."""
        solver = BY_NAME[engine]
        if solver.missing():
            raise NotImplementedError(solver.missing())
        self.scene = fourbar.load(SCENES[model])
        self.command = with_signs(self.scene.linkage, command(self.scene))
        self.adapter = solver.start()
        self.adapter.answer(self.scene, self.command)

    def time_answer(self, engine, model):
        """Answer every position of the model."""
        self.adapter.answer(self.scene, self.command)

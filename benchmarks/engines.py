"""Largest error, failing rows and time of every engine on every model, over commits and versions of the engines."""

import math

import fourbar
from fourbar.scene import command
from fourbar_validation.engines.witnesses import WITNESSES
from fourbar_validation.places import MODELS
from fourbar_validation.run.judge import judge

ENGINES = {witness.name: witness for witness in WITNESSES}
SCENES = {path.stem: path for path in sorted(MODELS.glob("*.toml"))}


class Verdict:
    """What `run` says of one engine on one model."""

    params = (list(ENGINES), list(SCENES))
    param_names = ("engine", "model")
    timeout = 600

    def setup_cache(self):
        """Judge each model once, by every engine that is installed."""
        here = [witness for witness in WITNESSES if not witness.missing()]
        verdicts = {}
        for model, path in SCENES.items():
            rows = judge(model, fourbar.load(path), here, order=False).rows
            for engine in ENGINES:
                judged = [row for row in rows if row.engine == engine and (row.compared or row.failed)]
                used = [math.inf if math.isnan(row.error) else row.error / row.allowed for row in judged if row.error]
                failing = sum(row.failed for row in judged) if judged else math.nan
                verdicts[engine, model] = max(used, default=math.nan), failing
        return verdicts

    def track_worst_error(self, verdicts, engine, model):
        """Return the largest error over the allowed one; NaN if the engine gave no answer to compare."""
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
        witness = ENGINES[engine]
        if witness.missing():
            raise NotImplementedError(witness.missing())
        self.scene = fourbar.load(SCENES[model])
        self.command, self.engine = command(self.scene), witness.engine()
        self.engine.answer(self.scene, self.command)

    def time_answer(self, engine, model):
        """Answer every position of the model."""
        self.engine.answer(self.scene, self.command)

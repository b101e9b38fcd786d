"""Studies: one scene, many linkages; what its quantities depend on."""

from fourbar.studies.derivatives import Sensitivity as Sensitivity
from fourbar.studies.derivatives import sensitivity as sensitivity
from fourbar.studies.enclosure import extremes as extremes
from fourbar.studies.spread import tolerances as tolerances
from fourbar.studies.study import Study as Study
from fourbar.studies.study import vary as vary

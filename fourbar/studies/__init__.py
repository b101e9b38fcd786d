"""Studies: one scene, many linkages."""

from fourbar.studies.study import Study as Study
from fourbar.studies.study import vary as vary

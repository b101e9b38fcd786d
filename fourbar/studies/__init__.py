"""Studies: one scene, many linkages; what its quantities depend on."""

from fourbar.studies.sensitivity import Sensitivity as Sensitivity
from fourbar.studies.sensitivity import sensitivity as sensitivity
from fourbar.studies.study import Study as Study
from fourbar.studies.study import vary as vary

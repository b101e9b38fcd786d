"""A suite: which scenes are judged, how they are spread over processes or machines, and how nothing is lost."""

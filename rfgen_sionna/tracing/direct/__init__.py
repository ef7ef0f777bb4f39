"""Direct returns of moving surfaces over an interval of time.

==================  ====================================================================
module              content
==================  ====================================================================
`settings`          pixels, pieces and knots for a tolerance
`facet_bounds`      bounds of facets' returns, from their slopes
`samples`           facets at one time: visible fractions, normals, gains
`time_error`        error of curves through the knots, by leaving one out
`expansion_choice`  smallest expansion over band and array that meets a tolerance
`run_scene`         moving surfaces of a run, and the radar that sees them
`trace_plan`        facets, expansion and settings of a run, with its measured errors
`planner`           choice of these
`knot_count`        number of knots of an interval
`other_diagonals`   surfaces whose quads are cut along the other diagonal
`direct_trace`      paths of one interval
==================  ====================================================================
"""

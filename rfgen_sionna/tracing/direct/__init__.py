"""Direct returns of moving surfaces over an interval of time.

=================  ====================================================================
module             content
=================  ====================================================================
`settings`         pixels, pieces and knots for a tolerance
`return_bounds`    bounds of facets' returns, from their slopes
`samples`          facets at one time: visible fractions, normals, gains
`time_error`       error of curves through the knots, by leaving one out
`run_scene`        moving surfaces of a run, and the radar that sees them
`expansion_choice` smallest expansion over band and array that meets a tolerance
`run_plan`         facets, expansion and settings of a run, with its measured errors
`direct_trace`     paths of one interval
`knots`            knots of delays alone, for given positions
=================  ====================================================================
"""

"""Actors over an interval of time, in the order of the stages.

=========================  ============================================================================
module                     contents
=========================  ============================================================================
`knots`                    times at which delays are known; errors of splines between times
`sample_times`             times at which gains and visibility are traced
`moving_facets`            facets of actors, refined as the motion demands; paths of facets
`clusters`                 small neighbouring facets that share a path
`culling`                  negligible facets
`visible_facets`           facets with their visible fraction
`moving_visibility`        visibility from the phase centre
`per_element_visibility`   visibility from single elements
`slab_transmission`        transmission of slabs beside shadow boundaries
`facet_returns`            returns of facets with the shadow weight (visible fraction) applied
`temporal_refinement`      additional times for facets that a shadow boundary crosses; its time error
`indirect_paths`           ghosts, planar reflectors, slabs, specular double bounces
`interval`                 data of an interval during its trace
`error_control`            facets and expansion as fine as the tolerance demands
`moving_trace`             all of it: `MovingTracer`
=========================  ============================================================================
"""

"""The tracer: physical optics on facets, from a scene, actors and a radar to paths.

Stages, in order, each with its module:

==============  =================================================================================================
stage           module
==============  =================================================================================================
surfaces        `surface.surfaces`: scene and actors to smooth surfaces
facets          `surface.tessellate`: pieces as small as the tolerance demands; `moving.moving_facets` of actors
sample times    `moving.knots`, `moving.sample_times`: times of delays, of gains and visibility
visibility      `moving.moving_visibility`, `static.static_visibility`: visible fraction of each facet
shadow weight   `moving.facet_returns` multiplies the return of a moving facet by its visible fraction
gains           `gains.band`: gains of all element pairs over the band
time error      `report`: definition; `moving.temporal_refinement` and `moving.sample_times` estimate it
paths           `moving.moving_trace`, `static.static_trace`: delays and gains over time; `tracer` joins them
==============  =================================================================================================

Packages import those above them only; `lint-imports` checks it.

==============  =================================================================================================
package         contents
==============  =================================================================================================
`max_bounces`   largest number of surfaces on a path
`relative`      moving radar: the world in the radar's frame
`surface`       smooth surfaces of meshes and their facets
`integral`      closed-form return of a facet
`shadows`       adaptive sampling, silhouettes, shadow boundaries
`gains`         gains of all element pairs over the band, with estimated errors
`ghosts`        images of actors in walls, floor and ceiling
`reflectors`    planar reflectors: corners, furniture
`transmission`  paths through slabs
`curved`        specular double bounces between curved surfaces
`moving`        actors over an interval of time
`static`        static scene, once per radar pose, and the shadows of actors on it
`sionna`        paths of Sionna's solvers, and our actors as its targets
`report`        result of a trace: paths, cost, estimated errors
`tracer`        scene, radar and actors to paths
==============  =================================================================================================
"""

"""The tracer: physical optics on facets, from a scene, actors and a radar to paths.

Packages build on those above them alone; `lint-imports` checks it.

=============  ================================================================================================
package        what
=============  ================================================================================================
`surface`      the smooth surface that a mesh stands for, cut into facets as fine as the tolerance asks for
`integral`     what a facet returns, in closed form
`shadows`      what is seen of facets: adaptive rays, shadows' edges, and where each pair of elements sees them
`gains`        facet gains of all element pairs over the band from few integrals, and what they err by
`ghosts`       what plane mirrors show of what moves: walls, floor, ceiling
`bounces`      what flat parts of anything show: corner reflectors, furniture
`transmission_tracer`        what is seen through slabs, directly and by further bounces
`curved`       what bent surfaces show of one another
`moving`       all of it for what moves, over stretches of time
`static`       all of it for what stays, once for each radar pose
`sionna`       paths of Sionna's solvers as ours, and our actors as its targets
`report`       cost and estimated errors of a trace
`traced`       paths over an interval of time
`max_bounces`  most surfaces on a path
`relative`     a radar that moves, seen from itself
`tracer`       scene, radar and actors to paths
=============  ================================================================================================
"""

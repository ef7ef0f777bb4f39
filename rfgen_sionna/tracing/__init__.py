"""The tracer: physical optics on facets, from a scene, actors and a radar to paths.

Stages, in order, each with its module; docs/architecture.md has the whole loop:

================  =================================================================================================
stage             module
================  =================================================================================================
surfaces          `surface.surfaces`: scene and actors to smooth surfaces
plan              `direct.planner`: facets, resolution and expansion of a run; `direct.knot_count`: its knots
visibility        `visibility.item_buffer`, `legs.leg_visibility`: visible fraction of each facet at each knot
routes            `routes.image_tree`: legs by mirrors and through slabs that matter
gains             `integral.patch_gains`: returns with the shadow weight; `gains.expansion`: of all element pairs
time error        `report`: definition; `direct.time_error` estimates it
paths             `direct.direct_trace`, `routes.route_trace`: delays and gains over time; `tracer` joins them
static scene      `static.static_trace`, `static.static_routes`: once per radar pose
================  =================================================================================================

Packages import those above them only; `lint-imports` checks it.

================  =================================================================================================
package           contents
================  =================================================================================================
`max_bounces`     largest number of surfaces on a path
`relative_scene`  moving radar: the world in the radar's frame
`visibility`      item buffers
`surface`         smooth surfaces of meshes and their facets
`integral`        returns of facets, also by mirrors and through slabs
`shadows`         rays: adaptive sampling, silhouettes, shadow boundaries of the static scene
`gains`           gains of all element pairs over the band, with estimated errors
`legs`            ways between the radar and facets: images, visibility along them, slabs
`curved`          specular double bounces between curved surfaces
`direct`          direct returns of moving surfaces over an interval of time
`routes`          leg out, facet, leg back: ghosts, corners, furniture
`static`          static scene, once per radar pose, and the shadows of actors on it
`report`          result of a trace: paths, cost, estimated errors
`trace_run`       state that persists from one interval to the next
`tracer`          scene, radar and actors to paths
`sionna`          paths of Sionna's solvers, and our actors as its targets
================  =================================================================================================
"""

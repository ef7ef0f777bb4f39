"""What flat parts of anything show of what moves, and it of them: corner reflectors, boards, furniture.

=================  ==================================================================
module             what
=================  ==================================================================
`reflectors`           flat parts with their outlines
`footprints`          where plates show facets: cut out of these, and which part is seen
`clipper`           their ray tubes on the facets of everything else
`roles`            which of two flat parts is the mirror
`mirror_shadows`   the shadows that plates' outlines throw, and what they fall on
`edge_transition`  what waves make of a straight edge of light and shadow
`mirror_edges`     what returns by way of plates err by for their outlines
`plate_images`     about how strong the radar sees itself by several of them
`bounces`          all of it
=================  ==================================================================
"""

#!/usr/bin/env bash
# specialise.sh SCATTER_H >COPY: a copy of the library in which the source and ray chapters know one
# class of scenes: Gaussians only, point lights in closed form, grey extinction, isotropic phase; no
# grid, constant or height fog, bounds, emission, occluders or surfaces. Every line below is such a
# fact; one that finds no place in the library any more is an error.
set -eu

facts='
s/\bc->medium\.has_analytic\b/0/g
s/\bm->has_analytic\b/0/g
s/\bm->has_local\b/1/g
s/\bm->desc\.bounded\b/0/g
s/\b(c->medium\.|m->)gray\b/1/g
s/\bc->scene\.visible == NULL/1/g
s/\b(eye->context|c)->scene\.visible != NULL/0/g
s/\bc->field_count\b/0/g
s/\beye->samples > 0/0/g
s/\bc->exact\b/1/g
s/\blight->source\.directional\b/0/g
s/\blight->desc\.kind == SCATTER_LIGHT_SPOT/0/g
s/\blight->desc\.kind != SCATTER_LIGHT_SPOT/1/g
s/\blight->depth\.method == SCATTER_DEPTH_CLOSED/1/g
s/\bif \(map->local\)/if (1)/g
s/\bif \(lobes\.weight > 0\.0f\)/if (0)/g
s/\bscatteri_draine\(lobes\.g1, lobes\.alpha1, omc\[l\]\)/0.079577472f/g
s/\beye->context->quality\.ray == SCATTER_RAY_MARCH/0/g
s/\breturn e\.x > 0\.0f \|\| e\.y > 0\.0f \|\| e\.z > 0\.0f/return e.x < 0.0f/g
'
chapters='/---- *>>source/,/---- *>>image/'
text=$(cat "$1")
while IFS= read -r fact; do
    [ -n "$fact" ] || continue
    next=$(sed -E "$chapters $fact" <<<"$text")
    [ "$next" != "$text" ] || { echo "specialise.sh: nothing to do for $fact" >&2; exit 1; }
    text=$next
done <<<"$facts"
printf '%s\n' "$text"

# gpu.sh - the steps of run.sh that compare pictures of the GPU with pictures of the CPU.
# shellcheck shell=bash disable=SC2034,SC2086,SC2154

# Scene, bound of the relative RMSE, API, settings of both sides, the shadow map of the GPU's; behind
# a # why 0.002 is out of reach.
gpu_cases() {
    cat <<'END'
one_gaussian     0.002 gl33   --depth closed --density exact
eight_gaussians  0.002 gl33   --depth closed --density exact
dense_core       0.002 gl33   --depth closed --density exact
coloured         0.002 gl33   --depth closed --density exact
coloured         0.002 gl45   --depth closed --density exact
coloured         0.002 es30   --depth closed --density exact
coloured         0.002 osmesa --depth closed --density exact
inside           0.002 gl33   --depth closed --density exact
horizon          0.002 gl33   --depth closed --density exact
spot             0.002 gl33   --depth closed --density exact
smoke            0.002 gl33   --depth closed --density exact
fire             0.002 gl33   --depth polar --grid 64 --density exact
window           0.002 gl33   --depth closed --density exact --shadow-map 8192
window           0.009 gl33   --depth closed --density exact # shafts end at texels of 2048x2048
two_lights       0.002 gl33   --depth polar --grid 64 --density volume --nodes 128
two_lights       0.009 gl33   --depth polar --grid 64 --density exact # 16 nodes cut otherwise
cloud            0.002 gl33   --depth closed --density exact --nodes 64
cloud            0.010 gl33   --depth closed --density exact # 16 nodes cut otherwise
cloud            0.006 gl33   --depth polar --density exact --nodes 64 # the CPU reads a lattice, the GPU columns, and both are that far from closed form
../skies/smoke_venice   0.002 gl33 --depth closed --density exact --nodes 64
../skies/spheres_studio 0.009 gl33 --depth polar --grid 64 --density exact --nodes 64 # CPU and GPU lay their columns differently
cumulus_1000     0.002 gl33   --depth closed-volume --grid 64 --density volume --nodes 64
cumulus_1000     0.041 gl33   --depth polar --grid 128 --density volume # 1.4 % (the CPU's lattice) and 2.7 % (columns through the density volume) off the exact picture
END
}

# gpu_render SCENE API OPTIONS...
gpu_render() {
    local scene=$1 api=$2
    shift 2
    "$OUT/gcc/scatter-render" "examples/scenes/$scene.scatter" --gl --api "$api" "$@"
}

# gpu_error SCENE API SETTINGS...: relative RMSE between both pictures.
gpu_error() {
    local reference=$OUT/gpu.$BASHPID.pfm scene=$1 api=$2 settings
    shift 2
    settings=$*
    "$OUT/gcc/scatter-render" "examples/scenes/$scene.scatter" --size 48x36 --out "$reference" \
        ${settings%%--shadow-map*} >/dev/null || return 1
    gpu_render "$scene" "$api" --size 48x36 --reference "$reference" --json "$@" ${GPU_FAULT-} |
        sed -n 's/.*"rel_rmse": *\([0-9.e+-]*\),.*/\1/p'
}

# gpu_agrees SCENE BOUND API SETTINGS...
gpu_agrees() {
    local scene=$1 bound=$2 error
    shift 2
    error=$(gpu_error "$scene" "$@")
    echo "$scene, $*: error $error, above $bound"
    awk -v e="$error" -v bound="$bound" 'BEGIN { exit !(e != "" && e + 0 <= bound + 0) }'
}

# gpu_case SCENE BOUND API SETTINGS... [# REASON]: one line of the table, and one check.
gpu_case() {
    local case=$* log=$OUT/gpu.log said=$OUT/log.$BASHPID
    if ! has_data "examples/scenes/$1.scatter"; then
        skip "$1: no data"
    elif ! gpu_render coloured "$3" --size 2x2 >"$log" 2>&1 && grep -Eq ' (EGL|OSMesa): ' "$log"; then
        skip "$1, $3: $(cat "$log")"
    else
        check "$1, $3" gpu_agrees ${case%%#*}
        sed 's/, above/ of/; s/^/  /' "$said"
        [ "$case" = "${case#*#}" ] || echo "      not 0.002:${case#*#}"
    fi
}

title_scenes_gl="the scenes through scatter_gl.h: what the CPU renders at equal settings"
step_scenes_gl() {
    local line
    make -j"$JOBS" BUILD=$OUT/gcc CC=gcc $OUT/gcc/scatter-render >$OUT/programs.log 2>&1
    while read -r line; do gpu_case $line; done < <(gpu_cases)
    if gpu_render coloured gl33 --size 2x2 >/dev/null 2>&1; then
        GPU_FAULT="--nodes 2" refuse "two nodes instead of 16" above \
            gpu_agrees inside 0.002 gl33 --depth closed --density exact --nodes 16
        GPU_FAULT="--shadow-map 16" refuse "coarse shadow maps" above \
            gpu_agrees window 0.009 gl33 --depth closed --density exact
    fi
}

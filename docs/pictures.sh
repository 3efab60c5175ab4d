#!/bin/sh
# Redraws the pictures of README.md and of docs/ in docs/images, with the program of this checkout. Takes a few minutes on two
# cores after the build.
#
#   docs/pictures.sh              all pictures
#   docs/pictures.sh tig view     those whose names begin so
#
# PERIMELT names a program to use instead of building one, PERIMELT_CHROMIUM a Chromium for pictures of the page (else one is
# looked for in PATH; without one they stay as they are). Logs are left in target/pictures.
set -eu
cd "$(dirname "$0")/.."
target=${CARGO_TARGET_DIR:-target}
perimelt=${PERIMELT:-$target/release/perimelt}
[ -n "${PERIMELT:-}" ] || cargo build --release
chromium=${PERIMELT_CHROMIUM:-$(command -v chromium || command -v chromium-browser || command -v google-chrome || true)}
work=$target/pictures
rm -rf "$work"
mkdir -p "$work"
patterns=$*

# wanted FILE: whether the picture is asked for
wanted() {
  [ -n "$patterns" ] || return 0
  for pattern in $patterns; do
    case $1 in $pattern*) return 0 ;; esac
  done
  return 1
}

# logged NAME CASE: runs a case into $work/NAME.mcap, once
logged() {
  [ -f "$work/$1.mcap" ] || "$perimelt" run "$2" --out "$work/$1.mcap" --quiet
}

# plotted FILE CASE PICTURE [OPTION ...]: FILE is the picture that `perimelt plot LOG OPTION ...` calls PICTURE
plotted() {
  file=$1 case=$2 picture=$3
  shift 3
  wanted "$file" || return 0
  name=$(basename "$case" .toml)
  logged "$name" "$case"
  "$perimelt" plot "$work/$name.mcap" --out "$work/$name" "$@" >"$work/plot.txt"
  cp "$work/$name/$picture" "docs/images/$file"
  echo "docs/images/$file"
}

# seen FILE CASE WIDTH,HEIGHT SETTINGS: FILE is the page of `perimelt view LOG` at the address that ends in #SETTINGS
seen() {
  wanted "$1" || return 0
  if [ -z "$chromium" ]; then
    echo "docs/images/$1: left as it is, no Chromium" >&2
    return 0
  fi
  name=$(basename "$2" .toml)
  logged "$name" "$2"
  "$perimelt" view "$work/$name.mcap" --no-open >"$work/address.txt" &
  server=$!
  until address=$(grep -o 'http://[^ ]*' "$work/address.txt"); do sleep 0.2; done
  # graphics by the processor, as in tests/tests/window/mod.rs
  "$chromium" --headless=new --no-sandbox --disable-dev-shm-usage --hide-scrollbars \
    --use-gl=angle --use-angle=swiftshader --enable-unsafe-swiftshader \
    --user-data-dir="$work/chromium" --window-size="$3" --virtual-time-budget=15000 \
    --screenshot="docs/images/$1" "$address#$4" 2>"$work/chromium.txt" || cat "$work/chromium.txt" >&2
  kill "$server"
  echo "docs/images/$1"
}

bead=cases/welding/bead_on_plate.toml
plotted bead_on_plate_temperature.png $bead plate-temperature-14s.png --field temperature --at 14
plotted bead_on_plate_melt_pool.png $bead plate-melt-pool.png
plotted bead_on_plate_displacement.png $bead plate-displacement-60s.png --field displacement --at 60
seen view.png $bead 1500,900 'cut=y0.5&time=14&scale=50&theme=light'

residual=cases/welding/residual_stress.toml
plotted residual_stress.png $residual plate-stress.xx-120s.png --field stress.xx --at 120 --deform 50 --width 900
plotted residual_distortion.png $residual plate-displacement.z-120s.png --field displacement.z --at 120 --deform 50 --width 900

plotted deposited_fillet.png cases/welding/deposited_fillet.toml joint-stress.xx-120s.png --field stress.xx --at 120 --section x=0.03 --deform 10 --width 900

plotted multi_pass_heat_treatment.png cases/welding/multi_pass_heat_treatment.toml probe-stress-along-the-weld.png --at 1800,30000

blast=cases/fracture/laminate_blast.toml
plotted laminate_blast_matrix.png $blast plate-damage.matrix-60µs.png --field damage.matrix --at 6e-5 --ply 1,2
plotted laminate_blast_sliding.png $blast plate-damage.sliding-60µs.png --field damage.sliding --at 6e-5 --ply 1,2

plotted haz_hardness.png cases/welding/haz_hardness.toml plate-hardness-60s.png --field hardness --at 60

plotted single_track_temperature.png cases/additive/single_track.toml block-temperature-0.55ms.png --field temperature --at 5.5e-4
plotted hatch_temperature.png cases/additive/hatch.toml block-temperature-6.3ms.png --field temperature --at 6.3e-3
seen wire_arc_wall.png cases/additive/wire_arc_wall.toml 1400,900 'time=252.5&theme=light'

# the case that docs/tutorial/own_case.md writes step by step, with its two mistakes corrected
tig=$work/tig.toml
awk '/^```/ { first = /toml/; keep = 0; next }
  first { first = 0; keep = /^# (add to )?tig\.toml/ }
  keep' docs/tutorial/own_case.md | sed 's/temperature = 20$/temperature = 293.15/; s/half_with/half_width/' >"$tig"
plotted tig_temperature.png "$tig" plate-temperature-4s.png --at 4 --celsius --section x=0.022
plotted tig_melt_pool.png "$tig" plate-melt-pool.png --at 4 --celsius --section x=0.022

# the command of docs/guide/melting.md
if wanted cooling_time_transition.svg; then
  "$perimelt" sweep cases/verification/cooling-time-plate.toml --out "$work/cooling-time" --set 'time.end=[8]' \
    --set 'bodies.plate.shape.box.min=[[0, -0.02, -0.008]]' \
    --set 'couplers.gaussian_source.power=[800, 1000, 1200, 1400, 1600, 1800, 2000, 2200, 2400]' \
    --compare 'cooling time=3.985e-4 * x' --compare 'cooling time=3.274e-7 * x^2' >"$work/sweep.txt"
  cp "$work/cooling-time/sweep.svg" docs/images/cooling_time_transition.svg
  echo docs/images/cooling_time_transition.svg
fi

#!/usr/bin/env bash
# Runs cases as 2 and 4 processes of MPI and compares with the run of one process: logs must be equal in every bit. Then it kills a run of several
# processes, and lets another number of processes finish it. Needs a program built with `--features mpi`:
#
#     cargo build --release -p perimelt --features mpi && tests/mpi.sh target/release/perimelt
set -euo pipefail
program="$(realpath "$1")"
cd "$(dirname "${BASH_SOURCE[0]}")/.."
case=cases/verification/wang-7.5.4.2-goldak-phase.toml
folder="$(mktemp -d)"
trap 'rm -rf "$folder"' EXIT

# more processes than cores and root in a container are allowed here
launch=(${PERIMELT_MPIEXEC:-mpiexec})
if "${launch[0]}" --version 2>&1 | grep -qi 'open *mpi\|openrte'; then
    launch+=(--oversubscribe --bind-to none)
    [ "$(id -u)" != 0 ] || launch+=(--allow-run-as-root)
fi

compare() {
    local file="$1" name="$2"
    shift 2
    "$program" run "$file" --out "$folder/$name.mcap" "$@" >/dev/null
    for count in 2 4; do
        "${launch[@]}" -n "$count" "$program" run "$file" --out "$folder/$name-$count.mcap" --threads 1 "$@" >/dev/null
        "$program" diff "$folder/$name.mcap" "$folder/$name-$count.mcap" | tail -1
    done
}
end=(--until 1)
compare "$case" one "${end[@]}"
# bonds break
compare cases/performance/block-47-ordinary.toml solid --set materials.glass.critical_stretch=5e-5
# metal flows
compare cases/verification/hill-sphere-staggered.toml metal
# a wall that is built up, and melt that flows
compare cases/verification/deposit-loaded-wall.toml wall
compare cases/welding/pool_flow.toml pool "${end[@]}"
# fragments that meet
compare cases/fracture/impact.toml fragments --until 1.2e-5

echo "a run of 2 processes, of which one is killed"
"${launch[@]}" -n 2 "$program" run "$case" --out "$folder/killed.mcap" --threads 1 "${end[@]}" >/dev/null 2>&1 &
while [ ! -e "$folder/killed.mcap" ]; do sleep 0.2; done
sleep 1
pkill -KILL -n -f "run $case --out $folder/killed.mcap" || true
wait || true
"${launch[@]}" -n 3 "$program" resume "$folder/killed.mcap" --threads 1 "${end[@]}" >/dev/null
"$program" diff "$folder/one.mcap" "$folder/killed.mcap" | tail -1
echo "processes of MPI: the same bits"

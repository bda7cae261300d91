"""Plants errors, one at a time, and demands that the tests of inference catch each: a test that cannot fail is a lie.

Works on the sources in place and restores them; takes about as many minutes as there are errors.

    python crates/twincal/tests/statistics/planted_bugs.py [number ...]
"""

import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[4]
SOURCE = ROOT / "crates" / "twincal" / "src"

# (name, file, right, wrong)
BUGS = [
    (
        "evidence without the determinant of A",
        "infer/exact/subtree.rs",
        "let odds = simd.mul_f64s(include_odds, simd.sqrt_f64s(r));",
        "let odds = include_odds;",
    ),
    (
        "a wrong one half: b0 + RSS instead of b0 + RSS/2",
        "infer/standard.rs",
        "let full_scale = b0 + 0.5 * misfit.max(0.0);",
        "let full_scale = b0 + misfit.max(0.0);",
    ),
    (
        "degrees of freedom a0 + n instead of a0 + n/2",
        "infer/standard.rs",
        "let shape = prior.shape + 0.5 * problem.n;",
        "let shape = prior.shape + problem.n;",
    ),
    (
        "the log-determinant of weights and stationary starts forgotten",
        "infer/standard.rs",
        "problem.log_constant\n            - prior.log_admissible()",
        "-prior.log_admissible()",
    ),
    (
        "one urn for all families",
        "infer/exact/plan.rs",
        ".filter(|&e| blocks[e].family == blocks[index].family)",
        ".filter(|&e| e < index)",
    ),
    (
        "posterior variance without the noise of beta",
        "infer/exact/sums.rs",
        "simd.mul_f64s(r, simd.mul_add_e_f64s(r, square, noise))",
        "simd.mul_f64s(r, simd.mul_f64s(r, square))",
    ),
    (
        "a stale tableau: gradients not updated when a column leaves",
        "infer/tableau.rs",
        "gradient[lane] += signed * b;",
        "gradient[lane] += 0.0 * signed * b;",
    ),
    (
        "an asymmetric swap: the slabs' ratio upside down",
        "infer/gibbs/swaps.rs",
        "slabs: both_ways(precision[1] / precision[0]),",
        "slabs: both_ways(precision[0] / precision[1]),",
    ),
    (
        "conditionals kept after a flip",
        "infer/gibbs/chain.rs",
        "        self.version += 1;\n",
        "",
    ),
    (
        "prior odds of a family not updated after a flip",
        "infer/gibbs/chain.rs",
        "        self.family_odds[family] = self.walker.family_odds(family);\n",
        "",
    ),
    (
        "a forgotten stationary factor: first rows count fully",
        "gram/mod.rs",
        "let (a, b, c) = ((1.0 - rho) * (1.0 - rho), rho, rho * (1.0 - rho));",
        "let (a, b, c) = ((1.0 - rho) * (1.0 - rho), rho, 1.0 - rho);",
    ),
    (
        "the difference over a cut lost",
        "gram/accumulate.rs",
        "self.before.copy_from_slice(last);",
        "self.before.copy_from_slice(&last.iter().map(|_| 0.0).collect::<Vec<_>>());",
    ),
    (
        "a component leaves and its square does not follow",
        "infer/tableau.rs",
        "        self.update_squares(j, pivot, -pivot);\n",
        "",
    ),
    (
        "the last columns of a component decide for themselves",
        "infer/exact/tree.rs",
        "                (inside, !inside)",
        "                (true, !inside)",
    ),
    (
        "an exchange without the determinant",
        "infer/walker.rs",
        "- 0.5 * pivot.determinant.ln()",
        "- 0.0 * pivot.determinant.ln()",
    ),
    (
        "a bounded slab that is not normalised",
        "infer/standard.rs",
        "factor: 1.0 / mass,",
        "factor: 1.0,",
    ),
    (
        "an interval score that fines misses half",
        "validate/scores.rs",
        "2.0 / 0.05 * outside",
        "1.0 / 0.05 * outside",
    ),
    (
        "a guarantee of 100 %",
        "validate/conformal.rs",
        "level: count as f64 / (count as f64 + 1.0),",
        "level: 1.0,",
    ),
    (
        "blocks of left-out rows counted as one",
        "calibrate/checks/left_out.rs",
        "(square / (count - 1.0) / count).sqrt()",
        "(square / (count - 1.0)).sqrt()",
    ),
    (
        "the expected number of a family spread over all components",
        "likelihood/structure.rs",
        "let own = size / expected - 1.0;",
        "let own = count as f64 / expected - 1.0;",
    ),
    (
        "a settled structure that the data may overrule",
        "prior.rs",
        "odds: vec![SETTLED, 1.0 / SETTLED],",
        "odds: vec![2.0, 0.5],",
    ),
    (
        "ranks without ties",
        "diagnostics/ranks.rs",
        "pooled.chunk_by(|a, b| a.0 == b.0)",
        "pooled.chunk_by(|_, _| false)",
    ),
    (
        "heredity without its renormaliser",
        "infer/standard.rs",
        "            - prior.log_admissible()\n",
        "",
    ),
    (
        "a parent leaves its child behind",
        "infer/kin.rs",
        "!self.children[block].iter().any(|&c| tableau.holds(c))",
        "true",
    ),
    (
        "a child is decided before its parent, and nobody asks",
        "infer/exact/plan.rs",
        "bound_by: self.kin.bound_by(self.index),",
        "bound_by: 0,",
    ),
    (
        "every draw counts as listed",
        "infer/gibbs/chain.rs",
        "let jumped = if listed {",
        "let jumped = if !jumps.is_empty() {",
    ),
    (
        "the weight of what is near e times too small",
        "infer/certain.rs",
        "Some(log_weight(problem, standard, &model) + moments",
        "Some(log_weight(problem, standard, &model) - 1.0 + moments",
    ),
    (
        "a move under bounds is guided, but not admitted by what the guide said",
        "infer/gibbs/chain/admission.rs",
        "(log_ratio - present - guide).exp()",
        "(log_ratio - present).exp()",
    ),
    (
        "an exchange that is never refused where it gains little",
        "infer/gibbs/acceptance.rs",
        "LAZY * gain.exp().min(1.0)",
        "(LAZY * gain.exp()).min(1.0)",
    ),
]


def caught():
    command = ["cargo", "test", "-q", "-p", "twincal", "--lib", "--test", "suite", "--"]
    command += ["infer::", "posterior::", "gram::", "diagnostics::", "prior::", "likelihood::"]
    command += ["plug_in::", "validate::", "calibrate::", "enumeration::", "many::", "calibration::"]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    output = result.stdout + result.stderr
    if "error[" in output or "could not compile" in output:
        sys.exit(f"does not compile:\n{output}")
    return result.returncode != 0


def main():
    chosen = [int(x) for x in sys.argv[1:]] or range(1, len(BUGS) + 1)
    missed = 0
    for number in chosen:
        name, file, right, wrong = BUGS[number - 1]
        path = SOURCE / file
        text = path.read_text()
        if right not in text:
            sys.exit(f"{number}: `{right}` does not stand in {file} any more")
        try:
            path.write_text(text.replace(right, wrong))
            found = caught()
        finally:
            path.write_text(text)
        missed += not found
        print(f"{number:2} {'caught' if found else 'MISSED'}  {name}", flush=True)
    sys.exit(missed)


if __name__ == "__main__":
    main()

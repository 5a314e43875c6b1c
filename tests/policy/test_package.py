"""What `import policy` loads and offers."""

import subprocess
import sys

import policy

HEAVY = ("torch", "lerobot", "pinocchio", "mujoco", "scipy", "placo", "llvmlite", "yaml")


def test_importing_policy_loads_numpy_only():
    code = f"import sys, policy; print([name for name in {HEAVY!r} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_everything_on_offer_exists_and_is_sorted_out():
    assert all(hasattr(policy, name) for name in policy.__all__)
    assert len(set(policy.__all__)) == len(policy.__all__)


def test_every_error_is_a_policy_error():
    errors = [getattr(policy, name) for name in policy.__all__ if name.endswith("Error")]
    assert all(issubclass(error, policy.PolicyError) for error in errors)

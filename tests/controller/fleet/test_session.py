"""controller.fleet.session: certificates and access control of a real router are obeyed."""

from __future__ import annotations

import shutil
import subprocess
import time
from pathlib import Path

import pytest

zenoh = pytest.importorskip("zenoh", reason="pip install 'omote[zenoh]'")

from controller.base.parameters import PARAMETERS as P  # noqa: E402
from tests.controller.fleet.nodes import Running, free_port, router, until  # noqa: E402

JAW = P.index("jawOpen")
RULES = {
    "enabled": True,
    "default_permission": "deny",
    "rules": [
        {
            "id": "conduct",
            "messages": ["put", "query", "reply", "declare_subscriber", "declare_queryable", "liveliness_token"],
            "flows": ["ingress", "egress"],
            "permission": "allow",
            "key_exprs": ["omote/**"],
        },
        {
            "id": "follow",
            "messages": ["declare_subscriber", "query", "declare_queryable", "reply", "liveliness_token"],
            "flows": ["ingress"],
            "permission": "allow",
            "key_exprs": ["omote/**"],
        },
        {"id": "hear", "messages": ["put", "reply", "query"], "flows": ["egress"], "permission": "allow",
         "key_exprs": ["omote/**"]},
        {"id": "say", "messages": ["put"], "flows": ["ingress"], "permission": "allow", "key_exprs": ["omote/*/state"]},
    ],
    "subjects": [
        {"id": "conductors", "cert_common_names": ["conductor"]},
        {"id": "heads", "cert_common_names": ["head"]},
    ],
    "policies": [
        {"rules": ["conduct"], "subjects": ["conductors"]},
        {"rules": ["follow", "hear", "say"], "subjects": ["heads"]},
    ],
}  # fmt: skip


def certificates(folder: Path, *names: str) -> None:
    """A certificate authority of its own, and a certificate for each name, by openssl."""
    if shutil.which("openssl") is None:
        pytest.skip("needs openssl")

    def openssl(*arguments: str) -> None:
        subprocess.run(["openssl", *arguments], cwd=folder, check=True, capture_output=True)

    key = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes")
    extensions = ("-addext", "basicConstraints=critical,CA:TRUE", "-addext", "keyUsage=keyCertSign,cRLSign")
    openssl(
        "req", "-x509", *key, "-days", "30", "-subj", "/CN=test", "-keyout", "ca.key", "-out", "ca.pem", *extensions
    )
    (folder / "ext").write_text("subjectAltName=IP:127.0.0.1,DNS:localhost\nbasicConstraints=CA:FALSE\n")
    for name in names:
        openssl("req", *key, "-subj", f"/CN={name}", "-keyout", f"{name}.key", "-out", f"{name}.csr")
        openssl("x509", "-req", "-in", f"{name}.csr", "-CA", "ca.pem", "-CAkey", "ca.key", "-CAcreateserial",
                "-days", "30", "-extfile", "ext", "-out", f"{name}.pem")  # fmt: skip


def tls(name: str) -> dict[str, str]:
    return {"ca": "ca.pem", "certificate": f"{name}.pem", "key": f"{name}.key"}


@pytest.mark.slow
def test_only_who_has_a_conductors_certificate_conducts(tmp_path: Path) -> None:
    certificates(tmp_path, "router", "conductor", "head")
    base = "transport/link/tls/"
    config = {
        base + "root_ca_certificate": str(tmp_path / "ca.pem"),
        base + "listen_certificate": str(tmp_path / "router.pem"),
        base + "listen_private_key": str(tmp_path / "router.key"),
        base + "enable_mtls": True,
        "access_control": RULES,
    }
    with router(config, f"tls/127.0.0.1:{free_port()}") as hub, Running(
        hub, "head", folder=tmp_path, tls=tls("head")
    ) as head:  # fmt: skip
        with Running(hub, "conductor", folder=tmp_path, tls=tls("head"), seed=3) as false:
            until(lambda: false.node.lease.active and false.node.published > 30)
            time.sleep(0.3)
            assert not head.node.followers["maple"].taken
        with Running(hub, "conductor", folder=tmp_path, tls=tls("conductor")) as conductor:
            conductor.states["maple"].set_parameters([JAW], [0.6], time.monotonic_ns())
            until(lambda: abs(head.rows["maple"][-1][JAW] - 0.6) < 1e-3)

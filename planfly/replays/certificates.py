"""Certificates that live as long as a process: who holds one proves that it belongs to that process's run."""

from datetime import UTC, datetime
from typing import NamedTuple

# Whatever a clock is set to while a run lasts, its certificate stays valid.
_FROM = datetime(1970, 1, 1, tzinfo=UTC)
_UNTIL = datetime(9999, 12, 31, tzinfo=UTC)


class Certificate(NamedTuple):
    """A self-signed certificate and its private key, as PEM text.

    Both exist in the memory of the run's processes, and, for the moment in which Python's TLS loads them, in a
    temporary folder that only their user can read.
    """

    certificate: str
    key: str


def temporary_certificate() -> Certificate:
    """Make a certificate for ``localhost`` with a new key (elliptic curve P-256); no two are alike.

    >>> one, other = temporary_certificate(), temporary_certificate()
    >>> one.certificate.splitlines()[0], one.key == other.key
    ('-----BEGIN CERTIFICATE-----', False)
    """
    # It takes as long to load as some commands take.
    from cryptography import x509
    from cryptography.hazmat.primitives import hashes, serialization
    from cryptography.hazmat.primitives.asymmetric import ec
    from cryptography.x509.oid import NameOID

    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "planfly")])
    certificate = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(_FROM)
        .not_valid_after(_UNTIL)
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(x509.SubjectAlternativeName([x509.DNSName("localhost")]), critical=False)
        .sign(key, hashes.SHA256())
    )
    private = key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )
    return Certificate(certificate.public_bytes(serialization.Encoding.PEM).decode(), private.decode())

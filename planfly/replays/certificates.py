"""Make certificates that prove that a connection belongs to this process.

They last as long as the process.
"""

from datetime import UTC, datetime
from typing import NamedTuple

# Start of validity, so early that the certificate stays valid if the clock is changed during the run.
_VALID_FROM = datetime(1970, 1, 1, tzinfo=UTC)
_VALID_UNTIL = datetime(9999, 12, 31, tzinfo=UTC)


class Certificate(NamedTuple):
    """A self-signed TLS certificate and its private key, as PEM text.

    Both are kept in memory.  Python's TLS can load them only from files, which exist only during the loading, in a
    temporary folder that only the user of the process can read.
    """

    certificate: str
    key: str


def make_temporary_certificate() -> Certificate:
    """Return a new self-signed certificate for ``localhost``, with a new private key.

    The key is on the elliptic curve P-256.

    >>> one, other = make_temporary_certificate(), make_temporary_certificate()
    >>> one.certificate.splitlines()[0], one.key == other.key
    ('-----BEGIN CERTIFICATE-----', False)
    """
    # Imported here because loading takes as long as some commands.
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
        .not_valid_before(_VALID_FROM)
        .not_valid_after(_VALID_UNTIL)
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(x509.SubjectAlternativeName([x509.DNSName("localhost")]), critical=False)
        .sign(key, hashes.SHA256())
    )
    private_key = key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )
    return Certificate(certificate.public_bytes(serialization.Encoding.PEM).decode(), private_key.decode())

//! Encryption of connections, by rustls.

use std::path::Path;
use std::sync::Arc;

use tokio_rustls::TlsAcceptor;
use tokio_rustls::rustls::ServerConfig;
use tokio_rustls::rustls::crypto::aws_lc_rs;
use tokio_rustls::rustls::pki_types::pem::PemObject as _;
use tokio_rustls::rustls::pki_types::{CertificateDer, PrivateKeyDer};

/// The certificate or its key is no good.
#[derive(Debug, thiserror::Error)]
#[error("{file}: {reason}")]
pub struct BadCertificate {
    file: String,
    reason: String,
}

/// Reads a chain of certificates, the server's own first, and its private key, both PEM.
///
/// # Errors
/// [`BadCertificate`] names the file and what is wrong with it; never what is in it.
pub fn acceptor(certificates: &Path, key: &Path) -> Result<TlsAcceptor, BadCertificate> {
    let bad = |file: &Path, reason: String| BadCertificate {
        file: file.display().to_string(),
        reason,
    };
    let chain: Vec<CertificateDer<'static>> = CertificateDer::pem_file_iter(certificates)
        .and_then(Iterator::collect)
        .map_err(|error| bad(certificates, error.to_string()))?;
    if chain.is_empty() {
        return Err(bad(
            certificates,
            "it must hold a PEM certificate, and holds none".to_owned(),
        ));
    }
    let private = PrivateKeyDer::from_pem_file(key).map_err(|error| bad(key, error.to_string()))?;
    // named: other crates of the process may bring providers of their own
    let provider = Arc::new(aws_lc_rs::default_provider());
    let mut config = ServerConfig::builder_with_provider(provider)
        .with_safe_default_protocol_versions()
        .map_err(|error| bad(certificates, error.to_string()))?
        .with_no_client_auth()
        .with_single_cert(chain, private)
        .map_err(|error| bad(certificates, format!("it does not go with the key: {error}")))?;
    config.alpn_protocols = vec![b"http/1.1".to_vec()];
    Ok(TlsAcceptor::from(Arc::new(config)))
}

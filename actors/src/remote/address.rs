//! Where a host listens, and the sockets behind it.

use std::{
    fmt, fs,
    io::{self, Read, Write},
    net::{Ipv4Addr, Ipv6Addr, Shutdown, SocketAddr, TcpListener, TcpStream, ToSocketAddrs},
    os::unix::{
        fs::FileTypeExt,
        net::{UnixListener, UnixStream},
    },
    path::PathBuf,
    str::FromStr,
    time::Duration,
};

/// How long a host is waited for that does not take the connection.
const CONNECT_LIMIT: Duration = Duration::from_secs(4);

/// A host's address.
///
/// ```
/// # use acm_actors::remote::Address;
/// let address: Address = "tcp://127.0.0.1:7400".parse()?;
/// assert_eq!(address.to_string(), "tcp://127.0.0.1:7400");
/// let address: Address = "unix:///run/robot.sock".parse()?;
/// assert_eq!(address, Address::Unix("/run/robot.sock".into()));
/// assert!("127.0.0.1:7400".parse::<Address>().is_err());
/// # Ok::<(), String>(())
/// ```
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Address {
    /// A socket file on this host.
    Unix(PathBuf),
    /// HOST:PORT. Whoever reaches it can drive the robot: there is no password.
    Tcp(String),
}

impl FromStr for Address {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        // There is no password to give, and what is given here is written down.
        if let Some((_, host)) = text.rsplit_once('@').filter(|_| text.starts_with("tcp://")) {
            return Err(format!("the address of `{host}` has a user or a password: robots take none, leave it out"));
        }
        let fault = |what: &str| Err(format!("`{text}` {what}: write tcp://127.0.0.1:7400 or unix:///path/to/socket"));
        match text.split_once("://") {
            Some(("unix", path)) if path.starts_with('/') => Ok(Address::Unix(path.into())),
            Some(("unix", _)) => fault("has no absolute path"),
            Some(("tcp", host)) => match host.rsplit_once(':') {
                Some((name, port)) if !name.is_empty() && port.parse::<u16>().is_ok() => Ok(Address::Tcp(host.into())),
                _ => fault("has no port"),
            },
            _ => fault("is no address of a robot"),
        }
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Address::Unix(path) => write!(f, "unix://{}", path.display()),
            Address::Tcp(host) => write!(f, "tcp://{host}"),
        }
    }
}

impl Address {
    /// Connects to the host that listens here.
    pub(super) fn connect(&self) -> io::Result<Stream> {
        match self {
            Address::Unix(path) => UnixStream::connect(path).map(Stream::Unix),
            Address::Tcp(host) => {
                let mut last = io::Error::new(io::ErrorKind::NotFound, "the name has no address");
                for address in host.to_socket_addrs()? {
                    match TcpStream::connect_timeout(&address, CONNECT_LIMIT) {
                        // Small messages go back and forth: none of them may wait to be sent together with the next.
                        Ok(stream) => return stream.set_nodelay(true).map(|()| Stream::Tcp(stream)),
                        Err(error) => last = error,
                    }
                }
                Err(last)
            }
        }
    }

    /// Begins to listen here. Port 0 takes any free one. A socket file that a killed host left is replaced.
    pub(super) fn listen(&self) -> io::Result<Listener> {
        match self {
            Address::Unix(path) => {
                if let Ok(found) = fs::symlink_metadata(path) {
                    if !found.file_type().is_socket() || UnixStream::connect(path).is_ok() {
                        return Err(io::ErrorKind::AddrInUse.into());
                    }
                    fs::remove_file(path)?;
                }
                Ok(Listener { socket: Socket::Unix(UnixListener::bind(path)?), address: self.clone() })
            }
            Address::Tcp(host) => {
                let socket = TcpListener::bind(host.as_str())?;
                let address = Address::Tcp(socket.local_addr()?.to_string());
                Ok(Listener { socket: Socket::Tcp(socket), address })
            }
        }
    }
}

#[derive(Debug)]
enum Socket {
    Unix(UnixListener),
    Tcp(TcpListener),
}

/// An open listening socket. A socket file goes with it.
#[derive(Debug)]
pub(super) struct Listener {
    socket: Socket,
    /// Where it listens, with the port that was found.
    pub address: Address,
}

impl Listener {
    /// Waits for the next connection.
    pub fn accept(&self) -> io::Result<Stream> {
        match &self.socket {
            Socket::Unix(socket) => socket.accept().map(|(stream, _)| Stream::Unix(stream)),
            Socket::Tcp(socket) => {
                let (stream, _) = socket.accept()?;
                stream.set_nodelay(true)?;
                Ok(Stream::Tcp(stream))
            }
        }
    }

    /// Where this very host is reached, to wake a waiting [`Listener::accept`].
    pub fn own_address(&self) -> Address {
        match &self.socket {
            Socket::Unix(_) => self.address.clone(),
            Socket::Tcp(socket) => match socket.local_addr() {
                Ok(SocketAddr::V4(at)) if at.ip().is_unspecified() => {
                    Address::Tcp(SocketAddr::from((Ipv4Addr::LOCALHOST, at.port())).to_string())
                }
                Ok(SocketAddr::V6(at)) if at.ip().is_unspecified() => {
                    Address::Tcp(SocketAddr::from((Ipv6Addr::LOCALHOST, at.port())).to_string())
                }
                _ => self.address.clone(),
            },
        }
    }
}

impl Drop for Listener {
    fn drop(&mut self) {
        if let Address::Unix(path) = &self.address
            && let Err(error) = fs::remove_file(path)
        {
            tracing::debug!(%error, "the socket file is gone already");
        }
    }
}

/// A connection.
#[derive(Debug)]
pub(super) enum Stream {
    Unix(UnixStream),
    Tcp(TcpStream),
}

impl Stream {
    pub fn try_clone(&self) -> io::Result<Stream> {
        match self {
            Stream::Unix(stream) => stream.try_clone().map(Stream::Unix),
            Stream::Tcp(stream) => stream.try_clone().map(Stream::Tcp),
        }
    }
    pub fn limit_read(&self, limit: Duration) -> io::Result<()> {
        match self {
            Stream::Unix(stream) => stream.set_read_timeout(Some(limit)),
            Stream::Tcp(stream) => stream.set_read_timeout(Some(limit)),
        }
    }
    pub fn limit_write(&self, limit: Duration) -> io::Result<()> {
        match self {
            Stream::Unix(stream) => stream.set_write_timeout(Some(limit)),
            Stream::Tcp(stream) => stream.set_write_timeout(Some(limit)),
        }
    }
    /// Ends the connection for both sides and for all clones.
    pub fn close(&self) {
        let closed = match self {
            Stream::Unix(stream) => stream.shutdown(Shutdown::Both),
            Stream::Tcp(stream) => stream.shutdown(Shutdown::Both),
        };
        if let Err(error) = closed {
            tracing::debug!(%error, "the connection is closed already");
        }
    }
}

impl Read for Stream {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self {
            Stream::Unix(stream) => stream.read(buffer),
            Stream::Tcp(stream) => stream.read(buffer),
        }
    }
}

impl Write for Stream {
    fn write(&mut self, buffer: &[u8]) -> io::Result<usize> {
        match self {
            Stream::Unix(stream) => stream.write(buffer),
            Stream::Tcp(stream) => stream.write(buffer),
        }
    }
    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_without_a_scheme_a_port_or_a_whole_path_are_refused() {
        for text in ["7400", "tcp://", "tcp://host", "tcp://:7400", "tcp://host:port", "unix://here", "http://host:80"]
        {
            let error = text.parse::<Address>().unwrap_err();
            assert!(error.contains(text) && error.contains("tcp://127.0.0.1:7400"), "{error}");
        }
    }

    #[test]
    fn a_stale_socket_file_is_replaced_and_a_live_one_or_another_file_is_not() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("socket");
        drop(UnixListener::bind(&path).unwrap());
        let address = Address::Unix(path.clone());
        let listener = address.listen().unwrap();
        assert_eq!(address.listen().unwrap_err().kind(), io::ErrorKind::AddrInUse);
        drop(listener);
        assert!(!path.exists());
        fs::write(&path, "precious").unwrap();
        assert!(address.listen().is_err());
        assert_eq!(fs::read_to_string(&path).unwrap(), "precious");
    }
}

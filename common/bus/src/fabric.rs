//! The node of this process and the services it creates or opens.

use std::fmt::Debug;
use std::rc::Rc;
use std::time::Duration;

use iceoryx2::config::Config;
use iceoryx2::node::{Node, NodeState, NodeView};
use iceoryx2::port::listener::Listener;
use iceoryx2::prelude::{
    AttributeSpecifier, AttributeVerifier, CallbackProgression, FileName, IceoryxSend, NodeBuilder, Path as IoxPath, SemanticString,
    ServiceName, SignalHandlingMode, ZeroCopySend, ipc,
};
use iceoryx2::service::attribute::{AttributeKey, AttributeValue};
use iceoryx2::service::builder::publish_subscribe::Builder;
use iceoryx2::service::port_factory::{event, publish_subscribe};
use messages::{FrameHeader, Layout, Payload, Pictures, Qos, Service};

use crate::error::BusError;
use crate::paths::DomainPaths;
use crate::slot::{FrameHeaderSlot, HeaderSlot, Slot};

/// Most processes that have one service open, spare places for killed ones included.
const MAX_NODES: usize = 48;
/// How long the remains of one dead node may take to remove.
const CLEANUP_TIMEOUT: Duration = Duration::from_secs(1);

pub(crate) type PubSub<T> = publish_subscribe::PortFactory<ipc::Service, Slot<T>, HeaderSlot>;
/// A service whose payload is the bytes of a picture.
pub(crate) type PicturePubSub = publish_subscribe::PortFactory<ipc::Service, [u8], FrameHeaderSlot>;
pub(crate) type Wake = event::PortFactory<ipc::Service>;

/// Where the messages of a service go.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Channel {
    /// To its readers.
    Open,
    /// To what stands between its publishers and its readers.
    Tapped,
}

impl Channel {
    fn name_of(self, service: &Service) -> String {
        match self {
            Self::Open => service.name.to_owned(),
            Self::Tapped => format!("{}~tapped", service.name),
        }
    }
}

/// A service that this process has open: its messages and, when sends wake readers, its event.
pub(crate) struct Opened<D> {
    pub(crate) service: Service,
    pub(crate) data: D,
    pub(crate) wake: Option<Wake>,
}

/// The node of this process.
pub(crate) struct Fabric {
    node: Node<ipc::Service>,
    config: Config,
}

impl Fabric {
    pub(crate) fn join(paths: &DomainPaths, process: &str) -> Result<Self, BusError> {
        let config = config(paths)?;
        let name = process.try_into().map_err(|error| BusError::refused("cannot name the node", process, error))?;
        let node = NodeBuilder::new()
            .name(&name)
            .config(&config)
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<ipc::Service>()
            .map_err(|error| BusError::refused("cannot make the node", process, error))?;
        Ok(Self { node, config })
    }

    /// Creates the service; the supervisor alone does, so that a process killed while starting leaves none half made.
    pub(crate) fn create<T: Payload>(&self, channel: Channel) -> Result<Opened<PubSub<T>>, BusError> {
        let service = T::SERVICE;
        let builder = self.builder::<T>(channel)?;
        let data = builder.create_with_attributes(&written(&service, T::HASH)?).map_err(|error| BusError::creating(service.name, error))?;
        Ok(Opened { service, data, wake: self.create_wake(&service, channel)? })
    }

    /// Creates a service of pictures.
    pub(crate) fn create_pictures<P: Pictures>(&self) -> Result<Opened<PicturePubSub>, BusError> {
        let service = P::SERVICE;
        let builder = self.picture_builder(&service)?;
        let attributes = written(&service, FrameHeader::HASH)?;
        let data = builder.create_with_attributes(&attributes).map_err(|error| BusError::creating(service.name, error))?;
        Ok(Opened { service, data, wake: self.create_wake(&service, Channel::Open)? })
    }

    pub(crate) fn open<T: Payload>(&self, channel: Channel) -> Result<Opened<PubSub<T>>, BusError> {
        let service = T::SERVICE;
        let builder = self.builder::<T>(channel)?;
        let attributes = expected(&service, T::HASH)?;
        let data = builder.open_with_attributes(&attributes).map_err(|error| BusError::opening(&service, T::HASH, error))?;
        Ok(Opened { service, data, wake: self.open_wake(&service, channel)? })
    }

    pub(crate) fn open_pictures<P: Pictures>(&self) -> Result<Opened<PicturePubSub>, BusError> {
        let service = P::SERVICE;
        let builder = self.picture_builder(&service)?;
        let attributes = expected(&service, FrameHeader::HASH)?;
        let data = builder.open_with_attributes(&attributes).map_err(|error| BusError::opening(&service, FrameHeader::HASH, error))?;
        Ok(Opened { service, data, wake: self.open_wake(&service, Channel::Open)? })
    }

    /// Removes what dead processes have left in the domain. Returns how many nodes were dead.
    pub(crate) fn remove_dead_nodes(&self) -> usize {
        let mut dead = Vec::new();
        let listed = Node::<ipc::Service>::list(&self.config, |state| {
            if let NodeState::Dead(view) = state {
                dead.push(view);
            }
            CallbackProgression::Continue
        });
        if let Err(error) = listed {
            tracing::warn!("cannot list the nodes of the domain: {error:?}");
        }
        for view in &dead {
            let id = view.id().value();
            if let Err(error) = view.clone().blocking_remove_stale_resources(CLEANUP_TIMEOUT) {
                tracing::warn!("cannot remove what dead node {id} left: {error:?}");
            }
        }
        dead.len()
    }

    fn builder<T: Payload>(&self, channel: Channel) -> Result<Builder<Slot<T>, HeaderSlot, ipc::Service>, BusError> {
        let service = T::SERVICE;
        let builder = self
            .node
            .service_builder(&service_name(&channel.name_of(&service))?)
            .publish_subscribe::<Slot<T>>()
            .user_header::<HeaderSlot>();
        Ok(shaped(builder, service.qos))
    }

    fn picture_builder(&self, service: &Service) -> Result<Builder<[u8], FrameHeaderSlot, ipc::Service>, BusError> {
        let builder = self.node.service_builder(&service_name(service.name)?).publish_subscribe::<[u8]>().user_header::<FrameHeaderSlot>();
        Ok(shaped(builder, service.qos))
    }

    fn create_wake(&self, service: &Service, channel: Channel) -> Result<Option<Wake>, BusError> {
        if !service.wakes {
            return Ok(None);
        }
        self.event_builder(service, channel)?.create().map(Some).map_err(|error| BusError::creating_event(service.name, error))
    }

    fn open_wake(&self, service: &Service, channel: Channel) -> Result<Option<Wake>, BusError> {
        if !service.wakes {
            return Ok(None);
        }
        self.event_builder(service, channel)?.open().map(Some).map_err(|error| BusError::opening_event(service.name, error))
    }

    fn event_builder(
        &self,
        service: &Service,
        channel: Channel,
    ) -> Result<iceoryx2::service::builder::event::Builder<ipc::Service>, BusError> {
        let Qos { subscribers, publishers, .. } = service.qos;
        let builder = self.node.service_builder(&service_name(&channel.name_of(service))?).event();
        Ok(builder.max_listeners(subscribers).max_notifiers(publishers).max_nodes(MAX_NODES))
    }
}

fn shaped<P: Debug + IceoryxSend + ?Sized, H: Debug + ZeroCopySend>(
    builder: Builder<P, H, ipc::Service>,
    qos: Qos,
) -> Builder<P, H, ipc::Service> {
    builder
        .max_publishers(qos.publishers)
        .max_subscribers(qos.subscribers)
        .max_nodes(MAX_NODES)
        .history_size(qos.history)
        .subscriber_max_buffer_size(qos.buffer)
        .subscriber_max_borrowed_samples(4)
        .enable_safe_overflow(true)
}

/// A listener of the service's event, if sends on it wake readers.
pub(crate) fn listener<D>(opened: &Opened<D>) -> Result<Option<Rc<Listener<ipc::Service>>>, BusError> {
    let Some(wake) = &opened.wake else { return Ok(None) };
    let listener = wake.listener_builder().create().map_err(|error| BusError::broken(opened.service.name, error))?;
    Ok(Some(Rc::new(listener)))
}

/// The configuration of iceoryx2 within one domain. Only the supervisor cleans up.
fn config(paths: &DomainPaths) -> Result<Config, BusError> {
    let root = paths.root();
    let refused = |detail: String| BusError::Refused { what: "cannot place", service: root.display().to_string(), detail };
    let mut config = Config::default();
    config.global.prefix = FileName::new(paths.prefix().as_bytes()).map_err(|error| refused(format!("{error:?}")))?;
    let path = IoxPath::new(root.as_os_str().as_encoded_bytes()).map_err(|error| refused(format!("{error:?}")))?;
    config.global.set_root_path(&path);
    config.global.node.cleanup_dead_nodes_on_creation = false;
    config.global.node.cleanup_dead_nodes_on_destruction = false;
    config.global.service.cleanup_dead_nodes_on_open = false;
    Ok(config)
}

fn service_name(name: &str) -> Result<ServiceName, BusError> {
    ServiceName::new(name).map_err(|error| BusError::refused("cannot name", name, error))
}

/// The contract as a service that is created carries it.
fn written(service: &Service, layout: u64) -> Result<AttributeSpecifier, BusError> {
    let (key, value) = contract(service, layout)?;
    AttributeSpecifier::new().define(&key, &value).map_err(|error| BusError::refused("cannot describe", service.name, error))
}

/// The contract as a service that is opened has to carry it.
fn expected(service: &Service, layout: u64) -> Result<AttributeVerifier, BusError> {
    let (key, value) = contract(service, layout)?;
    AttributeVerifier::new().require(&key, &value).map_err(|error| BusError::refused("cannot describe", service.name, error))
}

/// Version and layout of the payload, as the one attribute of its service.
fn contract(service: &Service, layout: u64) -> Result<(AttributeKey, AttributeValue), BusError> {
    let refused = |error| BusError::refused("cannot describe", service.name, error);
    let contract = service.contract(layout);
    let key: AttributeKey = "contract".try_into().map_err(refused)?;
    let value: AttributeValue = contract.as_str().try_into().map_err(refused)?;
    Ok((key, value))
}

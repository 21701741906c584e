mod distributed;
mod examples;
mod experiments;
mod gradient;
mod models;
mod recovery;
mod refusals;

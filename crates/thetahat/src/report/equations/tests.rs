mod distributed;
mod examples;
mod experiments;
mod gradient;
mod models;
mod noise;
mod recovery;
mod refusals;
